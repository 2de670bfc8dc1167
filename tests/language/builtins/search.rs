//! Searches of the built-ins by words.

use pcadlang_engine::lang::builtins::search::search;
use pcadlang_library::standard::table;

fn names(words: &str) -> Vec<String> {
    search(&table(), words).entries.iter().map(|b| b.full_name()).collect()
}

#[test]
fn the_best_come_first() {
    assert_eq!(names("normal")[..2], ["normal", "half_normal"]);
    assert_eq!(names("SQRT"), ["sqrt"]);
    assert_eq!(names("scene.mask")[0], "scene.mask");
    assert!(names("gaussian process").contains(&"gp".to_owned()));
    let kernels = names("kernels");
    assert!(kernels.len() > 10 && kernels[..5].contains(&"mh".to_owned()), "{kernels:?}");
    assert!(names("slice sampling").iter().take(2).any(|name| name == "slice"));
    assert!(names("angle degrees")[0] == "deg", "{:?}", names("angle degrees"));
    assert!(names("").is_empty() && names("?").is_empty());
}

#[test]
fn every_name_finds_itself_first() {
    let table = table();
    for b in table.iter() {
        let found = search(&table, &b.full_name()).entries;
        assert!(found.iter().take(2).any(|f| f.full_name() == b.full_name()), "{}", b.full_name());
    }
}

#[test]
fn words_of_other_languages_are_known() {
    for (words, name) in [
        ("lpdf", "log_density"),
        ("logp", "log_density"),
        ("normal_lpdf", "log_density"),
        ("target", "log_density"),
        ("T[", "truncated"),
        ("truncation", "truncated"),
        ("cholesky_decompose", "cholesky"),
        ("log_determinant", "logdet"),
        ("mdivide", "solve"),
        ("mdivide_left_spd", "solve"),
        ("half line", "flat"),
        ("positive_ordered", "ordered"),
        ("jitter", "gp"),
        ("recurrence", "fold"),
        ("bernoulli", "flip"),
        ("bernoulli_logit", "flip"),
        ("Bernoulli(logit_p)", "flip"),
        ("binomial_logit", "binomial"),
        ("categorical_logit", "categorical"),
        ("poisson_log", "poisson"),
        ("Phi", "normal_cdf"),
        ("std_normal_cdf", "normal_cdf"),
        ("normal_lcdf", "log_normal_cdf"),
        ("std_normal_lcdf", "log_normal_cdf"),
        ("invlogit", "expit"),
        ("inv_logit", "expit"),
        ("log1m_exp", "log1m_exp"),
        ("erfc", "erfc"),
        ("multi_normal_cholesky", "mv_normal"),
    ] {
        let found = names(words);
        assert!(found.iter().take(2).any(|f| f == name), "{words}: {found:?}");
    }
}

#[test]
fn misspelt_words_are_replaced() {
    let table = table();
    let found = search(&table, "chamfr");
    assert_eq!(found.instead, [("chamfr".to_owned(), "chamfer".to_owned())]);
    assert_eq!(found.entries[0].full_name(), "scene.chamfer");
    let found = search(&table, "qqqqqqq normal");
    assert_eq!(found.unknown, ["qqqqqqq"]);
    assert_eq!(found.entries[0].name, "normal");
    assert!(search(&table, "qqqqqqq").entries.is_empty());
}
