//! From meshes to contours: extraction, silhouettes, visibility.

pub(in crate::render) mod contours;
pub(in crate::render) mod crossing;
pub(in crate::render) mod extraction;
pub(in crate::render) mod silhouette;
pub(in crate::render) mod visibility;
