//! Scenes: files and the built-in one, as triangles.
