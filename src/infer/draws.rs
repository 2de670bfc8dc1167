//! stub
#![allow(missing_docs)]
use std::io;
#[derive(Debug,Clone)] pub enum Shape { Scalar, Vector(usize) }
#[derive(Debug,Clone)] pub struct Column { pub name: String, pub shape: Shape }
pub struct DrawRow { pub chain: u32, pub draw: u64, pub step: u64, pub log_joint: f64, pub log_prior: f64, pub log_likelihood: f64, pub values: Vec<f64> }
pub trait Sink: Send { fn columns(&mut self, columns: &[Column]) -> io::Result<()>; fn draw(&mut self, row: &DrawRow) -> io::Result<()>; fn chain_done(&mut self, chain: u32, steps: u64, warmup: u64, seconds: f64) -> io::Result<()>; }
#[derive(Debug,Clone,Default)] pub struct KernelStats { pub name: String, pub proposals: u64, pub accepted: u64, pub seconds: f64, pub failed: u64 }
