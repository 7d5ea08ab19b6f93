"""Pages of HTML that hold all they show: no request leaves them, and they work from the file system."""
