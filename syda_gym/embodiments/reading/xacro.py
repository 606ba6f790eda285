"""urdf_of_xacro: a xacro as a URDF, by xacro itself (extra ``xacro``)."""

from __future__ import annotations

from pathlib import Path

from syda_gym.errors import EmbodimentError

__all__ = ["expanding", "urdf_of_xacro"]


def expanding(path: Path) -> str:
    """How a person expands it without this library."""
    return f"`xacro {path.name} > {path.name.split('.')[0]}.urdf` expands it"


def urdf_of_xacro(path: Path) -> bytes:
    """Macros, properties and includes written out.

    It evaluates what the file says: call it in a process of its own (``converted_apart``).

    Args:
        path: a xacro, with the files that it includes.

    Returns:
        The URDF, as bytes of XML.

    Raises:
        EmbodimentError: it does not expand.
    """
    from xacrodoc import XacroDoc

    try:
        text: str = XacroDoc.from_file(str(path)).to_urdf_string()
    except Exception as error:  # xacro raises what its expressions raise
        raise EmbodimentError(
            f"{path} is xacro that does not expand: {error}; {expanding(path)} in a ROS workspace"
        ) from error
    return text.encode()
