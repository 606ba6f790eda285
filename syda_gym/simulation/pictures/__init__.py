"""Pictures and films of robots and operators; looks at worlds and moves nothing."""
