"""Files: written whole or not at all, and read within a budget, whoever made them."""

from syda_gym.files.archives import open_archive, read_arrays
from syda_gym.files.budget import BUDGET, Budget, check_size, read_bytes, shortened
from syda_gym.files.tensors import check_tensors
from syda_gym.files.trees import parse_json, read_json, read_yaml
from syda_gym.files.writing import asset, atomic_path, fingerprint, user_folder, write_bytes, write_json, write_text

__all__ = [
    "BUDGET",
    "Budget",
    "asset",
    "atomic_path",
    "check_size",
    "check_tensors",
    "fingerprint",
    "open_archive",
    "parse_json",
    "read_arrays",
    "read_bytes",
    "read_json",
    "read_yaml",
    "shortened",
    "user_folder",
    "write_bytes",
    "write_json",
    "write_text",
]
