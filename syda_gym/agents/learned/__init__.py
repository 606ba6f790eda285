"""What learning leaves behind: agents that act, in numpy; how they were taught is told in their own rooms."""
