"""What happens when things go wrong: bad input, hostile files, kills, long runs. Renews docs/reliability.md."""
