//! Errors of building shapes.

/// The reason why a shape cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeomError {
    /// A number outside its domain: the scene is impossible.
    #[error("{0}")]
    Domain(String),
    /// An invalid mesh, or a file that cannot be read as one.
    #[error("{0}")]
    Invalid(String),
}

impl GeomError {
    pub(super) fn domain(message: impl Into<String>) -> Self {
        GeomError::Domain(message.into())
    }

    /// A mistake that ends the run.
    pub fn invalid(message: impl Into<String>) -> Self {
        GeomError::Invalid(message.into())
    }
}
