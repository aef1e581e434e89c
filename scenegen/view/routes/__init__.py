"""What the server answers, one route per file. Each route is made for an `Shared`: all that routes share."""
