"""A fleet whose robots live in several processes, a share of them in each; nothing here knows of Gymnasium."""
