//! The animation of a glTF file: channels and samplers.

use serde_json::{Value, json};

/// The channels and samplers of an animation under way.
pub struct Animation {
    /// The accessor of the times.
    times: usize,
    channels: Vec<Value>,
    samplers: Vec<Value>,
}

impl Animation {
    /// An animation at the times of an accessor.
    pub fn at(times: usize) -> Animation {
        Animation { times, channels: Vec::new(), samplers: Vec::new() }
    }

    /// Returns its JSON.
    pub fn finish(self) -> Value {
        json!({ "name": "states", "channels": self.channels, "samplers": self.samplers })
    }

    /// Animates a property of a node. `how` is `LINEAR` or `STEP`.
    pub fn channel(&mut self, node: usize, path: &str, output: usize, how: &str) {
        let sampler = json!({ "input": self.times, "output": output, "interpolation": how });
        let target = json!({ "node": node, "path": path });
        self.channels.push(json!({ "sampler": self.samplers.len(), "target": target }));
        self.samplers.push(sampler);
    }
}
