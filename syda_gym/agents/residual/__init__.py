"""How a residual policy is taught: by reinforcement learning, in legs that can be interrupted and resumed."""
