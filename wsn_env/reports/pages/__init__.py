"""Pages to look at: self-contained HTML, no server, no network."""
