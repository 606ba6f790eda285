"""Looks at every built page in a browser: does code fit, does the page itself scroll sideways?

    make docs && python scripts/check_pages.py [--site site] [--width 1440]

Needs Chromium and its driver (selenium). Prints the blocks that scroll; exit code 1 if there are any.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

_WIDE = """
const blocks = [...document.querySelectorAll("article pre > code")];
const wide = blocks.filter(code => code.scrollWidth > code.clientWidth + 1);
const page = document.documentElement;
return [wide.map(code => code.innerText.split("\\n").reduce((a, b) => a.length > b.length ? a : b)),
        page.scrollWidth > page.clientWidth + 1];
"""


def main() -> int:
    """Opens each page from disk."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--site", type=Path, default=Path("site"))
    parser.add_argument("--width", type=int, default=1440)
    given = parser.parse_args()
    pages = sorted(given.site.resolve().rglob("*.html"))
    if not pages:
        raise SystemExit(f"no pages in {given.site}; run make docs")
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    for word in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", f"--window-size={given.width},900"):
        options.add_argument(word)
    browser = webdriver.Chrome(options=options)
    faults = 0
    try:
        for page in pages:
            browser.get(page.as_uri())
            wide, sideways = browser.execute_script(_WIDE)
            for line in wide:
                print(f"{page.relative_to(given.site.resolve())}: code scrolls at {given.width} px: {line.strip()}")
            if sideways:
                print(f"{page.relative_to(given.site.resolve())}: the page scrolls sideways")
            faults += len(wide) + bool(sideways)
    finally:
        browser.quit()
    print(f"{len(pages)} pages, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
