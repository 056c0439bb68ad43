"""What of patent CN103152791 is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE: tuple[Item, ...] = ()
