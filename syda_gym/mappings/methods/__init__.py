"""One file a method: from paired frames to a fitted mapping; knows coding and models, not how results are judged."""
