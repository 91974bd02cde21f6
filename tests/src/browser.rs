//! A real browser without a window, for pages.
