"""What ``mkdocs`` runs on every page: equations become MathML, so that no script is fetched to show them."""

from __future__ import annotations

import html
import re
from typing import Any

from latex2mathml.converter import convert

_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


def on_page_content(content: str, **_: Any) -> str:
    """Replaces every equation that pymdownx.arithmatex has marked by MathML."""
    content = _INLINE.sub(lambda match: convert(html.unescape(match[1]).strip()), content)
    return _BLOCK.sub(lambda match: convert(html.unescape(match[1]).strip(), display="block"), content)
