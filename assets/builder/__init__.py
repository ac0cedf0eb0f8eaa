"""What the built-in scenes are made of: shapes, procedural textures, and a small GLB writer."""
