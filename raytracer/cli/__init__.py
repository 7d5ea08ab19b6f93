"""Define the commands of `rt`, one file a command; what several share is in `base/`."""
