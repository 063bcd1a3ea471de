//! Plays a camera path under a budget beside fixed presets.
