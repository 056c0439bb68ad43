"""The published systems and other named scenarios: a file each, whose name is the id with _ for -."""
