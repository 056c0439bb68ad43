"""What of Xiang & Guo (2013) is rebuilt, and where."""

from wsn_env.papers.coverage import Item

COVERAGE: tuple[Item, ...] = ()
