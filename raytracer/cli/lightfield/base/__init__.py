"""Hold what the commands for light fields share."""
