//! Indices of fields and codes of operators in TFLite files (schema.fbs, version 3).

/// Fields of tables, by index.
pub mod field {
    pub const CODES: usize = 1;
    pub const GRAPHS: usize = 2;
    pub const BUFFERS: usize = 4;
    pub mod code {
        pub const SHORT: usize = 0;
        pub const CUSTOM: usize = 1;
        pub const LONG: usize = 3;
    }
    pub mod graph {
        pub const TENSORS: usize = 0;
        pub const INPUTS: usize = 1;
        pub const OUTPUTS: usize = 2;
        pub const OPERATORS: usize = 3;
    }
    pub mod tensor {
        pub const SHAPE: usize = 0;
        pub const KIND: usize = 1;
        pub const BUFFER: usize = 2;
        pub const SPARSITY: usize = 6;
    }
    pub mod operator {
        pub const CODE: usize = 0;
        pub const INPUTS: usize = 1;
        pub const OUTPUTS: usize = 2;
        pub const OPTIONS: usize = 4;
    }
}

/// Operator codes (TFLite's `BuiltinOperator`).
pub mod code {
    pub const ADD: i32 = 0;
    pub const AVERAGE_POOL: i32 = 1;
    pub const CONCATENATION: i32 = 2;
    pub const CONVOLUTION: i32 = 3;
    pub const DEPTHWISE: i32 = 4;
    pub const DEPTH_TO_SPACE: i32 = 5;
    pub const DEQUANTIZE: i32 = 6;
    pub const SIGMOID: i32 = 14;
    pub const MAX_POOL: i32 = 17;
    pub const MULTIPLY: i32 = 18;
    pub const RELU: i32 = 19;
    pub const RESHAPE: i32 = 22;
    pub const RESIZE: i32 = 23;
    pub const CUSTOM: i32 = 32;
    pub const PAD: i32 = 34;
    pub const MEAN: i32 = 40;
    pub const HARD_SWISH: i32 = 117;
    pub const DENSIFY: i32 = 124;
}

/// MediaPipe's own operator.
pub const TRANSPOSED: &[u8] = b"Convolution2DTransposeBias";
