"""`scenegen view`: a page where a person writes a spec and sees its scenes while typing."""
