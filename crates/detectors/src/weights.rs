//! The included networks: unmodified files of MediaPipe, under the Apache License 2.0.

/// Finds people in a picture, roughly: `pose_detection.tflite`.
pub const DETECTION: &[u8] = include_bytes!("../pose_detection.tflite");

/// Finds the 33 landmarks of a person in a window: `pose_landmark_full.tflite`.
pub const LANDMARKS: &[u8] = include_bytes!("../pose_landmark_full.tflite");
