"""From a body's frames to the codes that models see, and back; knows bodies, no training."""
