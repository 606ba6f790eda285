"""What an episode is: options, clips, starts, disturbances, observation and reward; steps no world."""
