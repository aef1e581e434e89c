"""What `import scenegen` offers; scenegen/__init__.py says which name lives in which module."""
