//! Detection of contours in photographs, built in and by files of users.

pub mod detector;
pub mod file_detector;
pub mod forest;
pub mod gradient;
pub(in crate::vision) mod network_options;
pub mod nms;
#[cfg(feature = "onnx")]
pub mod onnx;
pub mod soft_map;
pub(in crate::vision) mod thin;
