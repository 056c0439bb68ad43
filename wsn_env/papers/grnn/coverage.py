"""What of the FOA-GRNN text is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE: tuple[Item, ...] = ()
