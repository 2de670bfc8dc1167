//! From derivatives by pictures to derivatives by vertices.

pub(in crate::render) mod fractions;
pub(in crate::render) mod junctions;
pub(in crate::render) mod outline;
pub(in crate::render) mod silhouette_derivative;
pub(in crate::render) mod surface;
pub(in crate::render) mod vjp;
