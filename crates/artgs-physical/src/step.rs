//! Steps of an export.

/// A step of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportStep {
    /// Closed and textured meshes.
    Surfaces,
    /// Masses and joint limits.
    Limits,
    /// Convex pieces.
    Hulls,
    /// Files.
    Write,
}

impl ExportStep {
    /// Name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Surfaces => "surfaces",
            Self::Limits => "limits",
            Self::Hulls => "hulls",
            Self::Write => "write",
        }
    }
}
