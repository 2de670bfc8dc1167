//! Random programs.

use proptest::prelude::*;

/// Programs of a few choices that depend on each other through arithmetic, branches,
/// loops and arrays.
pub fn program() -> impl Strategy<Value = String> {
    let number = |n: usize| {
        prop_oneof![
            (0..n.max(1)).prop_map(move |i| if n == 0 { "1".to_owned() } else { format!("x{i}") }),
            (-20..20i32).prop_map(|k| format!("({}.0 / 10)", k)),
        ]
    };
    let expression = move |n: usize| {
        (number(n), number(n), number(n), 0..6usize).prop_map(|(a, b, c, kind)| match kind {
            0 => format!("{a} + 0.5 * {b}"),
            1 => format!("sin({a}) * {b}"),
            2 => format!("if {a} > {b} {{ {c} }} else {{ {a} - 1 }}"),
            3 => format!("[{a}, {b}, {c}][1]"),
            4 => format!("max({a}, {b})"),
            _ => a,
        })
    };
    let choice = move |i: usize| {
        (expression(i), 0..5usize).prop_map(move |(e, kind)| match kind {
            0 | 1 => format!("assume x{i} ~ normal({e}, 1);"),
            2 => format!("assume f{i} ~ flip(0.4); assume x{i} = if f{i} {{ a ~ normal({e}, 1); a }} else {{ {e} }};"),
            3 => format!("assume x{i} ~ categorical([1, 2, 1 + abs({e})]);"),
            _ => format!("assume f{i} ~ flip(0.3); let x{i} = if f{i} {{ {e} }} else {{ 0.5 }};"),
        })
    };
    let choices: Vec<_> = (0..5).map(choice).collect();
    (choices, expression(5), expression(5)).prop_map(|(choices, a, b)| {
        format!(
            "{}\nfor i in 0 .. 4 {{ g[i] ~ flip(0.2); let u = {b}; observe normal(if g[i] {{ {a} }} else {{ u + i }}, 1) = 0.3 * i; }}
             observe normal({a}, 2) = 1;
             infer {{ warmup 20 {{ drift(@**); }}
               repeat 60 {{ mix {{ 0.3 => mh(one(@**)); 0.2 => gibbs(one($finite)); 0.2 => gibbs(each($finite));
                                   0.2 => drift(one($continuous)); 0.1 => block(@**);
                                   0.1 => nuts($continuous, max_depth = 3); }} }} }}",
            choices.join("\n")
        )
    })
}
