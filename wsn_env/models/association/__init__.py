"""Of which target a report is, a kind a file: how reports are named, and what a head makes of those that are not."""
