//! gi
