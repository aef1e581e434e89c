"""Where scenes live: the workspace, and the pydantic models of scene files."""
