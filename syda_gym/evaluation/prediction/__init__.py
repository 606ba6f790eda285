"""Does transferability predict? The study, its scores and its picture."""
