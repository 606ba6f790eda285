"""A page in the browser that shows bodies as they move; it runs in a process of its own and moves nothing itself."""
