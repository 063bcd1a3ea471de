//! A display-referred picture.

/// 8-bit sRGB, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `width` × `height` × (red, green, blue).
    pub rgb: Vec<[u8; 3]>,
}
