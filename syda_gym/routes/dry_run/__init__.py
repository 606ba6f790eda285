"""The rehearsal of a route on paper: imitation, noise, links, score; fits no mapping and plays nothing."""
