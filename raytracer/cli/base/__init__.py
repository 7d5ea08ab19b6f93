"""Hold what all commands share: the application, and options that several have."""
