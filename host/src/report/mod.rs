//! Reports of a run: JSON, CSV, SVG.
