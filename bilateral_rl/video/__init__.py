"""Videos of trained controllers at work."""

from bilateral_rl.video.command import render

__all__ = ["render"]
