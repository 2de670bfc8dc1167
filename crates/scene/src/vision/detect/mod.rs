//! Detection of contours in photographs: the built-in detector, and what others plug into.

pub mod detector;
pub mod gradient;
pub mod soft_map;
pub(in crate::vision) mod thin;
