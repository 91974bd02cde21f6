//! The tree handed out: decoding, validation, quality, file.
