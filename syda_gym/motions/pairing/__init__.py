"""Two recordings of one action become paired frames: matched, aligned, checked; fits no mapping."""
