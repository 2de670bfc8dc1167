//! The networks with which `pcadlang` finds people: unmodified files of MediaPipe, under
//! the Apache License 2.0.

#![no_std]

/// Finds people in a picture, roughly: `pose_detection.tflite`.
pub const DETECTION: &[u8] = include_bytes!("../pose_detection.tflite");

/// Finds the 33 landmarks of a person in a window: `pose_landmark_full.tflite`.
pub const LANDMARKS: &[u8] = include_bytes!("../pose_landmark_full.tflite");
