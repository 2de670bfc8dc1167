//! What can be wrong with a shape.

/// A shape that cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeomError {
    /// A number outside its domain: a scene that is impossible.
    #[error("{0}")]
    Domain(String),
    /// A mesh that makes no sense, or a file that cannot be read as one.
    #[error("{0}")]
    Invalid(String),
}

impl GeomError {
    pub(super) fn domain(message: impl Into<String>) -> Self {
        GeomError::Domain(message.into())
    }

    pub(super) fn invalid(message: impl Into<String>) -> Self {
        GeomError::Invalid(message.into())
    }
}
