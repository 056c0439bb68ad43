"""What happens when things go wrong: bad input, hostile files, kills, long runs. For docs/reliability.md, errors.md."""
