//! The included networks: unmodified files of MediaPipe, under the Apache License 2.0.

/// Finds people in a picture, roughly: `pose_detection.tflite`.
pub static DETECTION: &[u8] = include_bytes!("../pose_detection.tflite");

/// Finds the 33 landmarks of a person in a window: `pose_landmark_full.tflite`.
pub static LANDMARKS: &[u8] = include_bytes!("../pose_landmark_full.tflite");
