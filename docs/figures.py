"""Every table and picture of the pages that a command makes: the commands, and the pages filled with what they wrote.

    python docs/figures.py                      # all that need no training; half an hour
    python docs/figures.py reproduce            # one of MAKERS
    python docs/figures.py --fill               # the pages anew from what is there in out/figures

A command writes tables as NAME.md, and pictures, into out/figures/COMMAND. A page shows them between markers,
`<!-- begin COMMAND/NAME -->` and `<!-- end COMMAND/NAME -->`, and as `images/COMMAND/NAME.png`.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

from wsn_env.evaluation.files import replacing
from wsn_env.reports.markdown import block_names, fill_blocks

HERE = Path(__file__).parent
ROOT = HERE.parent
OUT = ROOT / "out" / "figures"
IMAGES = HERE / "images"
MAKERS: dict[str, list[str]] = {  # name: module and arguments; `--out FOLDER` is added
    "reproduce": ["wsn_env", "reproduce", "all"],
}


def pages() -> list[Path]:
    """All that may have blocks."""
    return [ROOT / "README.md", *sorted(HERE.rglob("*.md"))]


def make(name: str) -> None:
    """Run a command; what it wrote before is gone."""
    folder = OUT / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    start = time.perf_counter()
    subprocess.run([sys.executable, "-m", *MAKERS[name], "--out", str(folder)], cwd=ROOT, check=True)
    print(f"{name}: {time.perf_counter() - start:.0f} s", flush=True)


def fill(out: Path = OUT) -> list[Path]:
    """Fill every page from the commands' folders that are there, and renew its pictures. Returns the pages changed.

    Raises:
        ValueError: if a page names a table that its command did not write.
    """
    made = [name for name in MAKERS if (out / name).is_dir()]
    changed = []
    for page in pages():
        old = page.read_text(encoding="utf-8")
        blocks = {}
        for block in block_names(old):
            if block.partition("/")[0] in made:
                table = out / f"{block}.md"
                if not table.exists():
                    raise ValueError(f"{page.relative_to(ROOT)}: block {block!r}: {table} was not written")
                blocks[block] = table.read_text(encoding="utf-8")
        new = fill_blocks(old, blocks)
        if new != old:
            with replacing(page) as temporary:
                temporary.write_text(new, encoding="utf-8")
            changed.append(page)
        for picture in re.findall(r"images/([\w./-]+\.png)\)", new):
            if picture.partition("/")[0] in made:
                (IMAGES / picture).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(out / picture, IMAGES / picture)
    return changed


def main() -> None:
    """Run commands, fill pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(MAKERS)}; left out: all")
    parser.add_argument("--fill", action="store_true", help="run nothing")
    asked = parser.parse_args()
    unknown = [name for name in asked.names if name not in MAKERS]
    if unknown:
        parser.error(f"names = {unknown}: unknown; allowed are {', '.join(MAKERS)}")
    for name in [] if asked.fill else asked.names or MAKERS:
        make(name)
    for page in fill():
        print(f"renewed: {page.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
