"""Draws pictures of a built-in scene: a few keyframes side by side, flat shaded."""

from figures.scene_pictures import main

if __name__ == "__main__":
    main()
