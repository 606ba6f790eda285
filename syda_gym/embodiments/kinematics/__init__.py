"""A URDF as trees and serial chains, with their limits, forward kinematics and Jacobians; knows no bodies."""
