//! Reciprocity of the tracer, recovery of dual images, and of sources.

use super::*;
