//! Tests of the page as a whole.

use super::*;

fn quantity(name: &str) -> Quantity {
    let chains = vec![vec![1.0, 2.0, 4.0, 3.0, 2.0], vec![9.0, 8.0, 9.5, 9.0, 8.5]];
    Quantity::new(name, Some(0), chains)
}

#[test]
fn the_page_is_whole_and_escapes_what_it_quotes() {
    let text = "</pre><script>alert(1)</script> & \"s\" 'q'";
    let q = quantity(text);
    let kernel = KernelStats { name: text.into(), ..Default::default() };
    let picture = Figure { caption: text, file: vec![1, 2, 3], lines: false };
    let page = page(&Page {
        title: text,
        found: Some(text),
        facts: vec![text.into()],
        command: text,
        program: text,
        pictures: vec![vec![picture]],
        scene: Some("{\"draws\":[],\"photo\":\"</script>\"}"),
        settings: vec![("seed", text.into())],
        modes: &super::super::modes(std::slice::from_ref(&q), None),
        mode_pictures: vec![Some(vec![1, 2, 3])],
        quantities: &[q],
        kernels: &[kernel],
        warnings: &[text.into()],
        approximate: &[text.into()],
    });
    // Possible line breaks are not part of the names; the programs of the viewer and of the
    // plots are a single script each.
    let mut page = page.replace("<wbr>", "");
    for (data, size) in [("scene", 100_000), ("plot-data", 10_000)] {
        let data = page.find(&format!("id=\"{data}\"")).expect("the program has its data");
        let begin = data + page[data..].find("<script>\n").expect("and is there");
        let end = begin + page[begin..].find("</script>").unwrap();
        assert!(end - begin > size, "it is whole");
        page = [&page[..begin], "<script>", &page[end..]].concat();
    }
    assert!(
        !page.contains("alert(1)</") && !page.contains("& ") && !page.contains("alert(1)<"),
        "escaped"
    );
    assert_eq!(
        page.matches("&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;s&quot;").count(),
        15
    );
    assert_eq!(
        page.matches("data:image/png;base64,AQID").count(),
        2,
        "the picture, and that of a mode"
    );
    assert!(page.contains("{\"draws\":[],\"photo\":\"<\\/script>\"}"), "no script ends early");
    assert!(page.contains("<td class=\"bad\">") && page.contains("<td>0<td>-<td>0<td>0.00 s"));
    assert!(page.ends_with("</html>") && !page.contains("http"), "nothing comes from the network");
    for tag in [
        "table", "div", "figure", "script", "svg", "canvas", "pre", "h2", "section", "nav", "ul",
        "p",
    ] {
        let opened =
            page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }
}

/// Who reads one line reads whether the object was found.
#[test]
fn the_verdict_is_the_first_line() {
    let facts = vec!["2 chains".into()];
    let all = Page { title: "cup", found: Some("found: <95%>"), facts, ..Page::default() };
    let text = page(&all);
    let below = text.split("</h1>\n").nth(1).unwrap();
    assert!(below.starts_with("<p class=\"found\">found: &lt;95%&gt;</p>\n<p class=\"facts\">"));
    assert!(!page(&Page { found: None, ..all }).contains("class=\"found\""));
}

/// Every part has a link, and every link has a target.
#[test]
fn links_lead_to_parts() {
    let text = page(&Page {
        quantities: &[quantity("a"), quantity("b")],
        program: "1",
        ..Page::default()
    });
    let links: Vec<&str> =
        text.split("href=\"#").skip(1).filter_map(|l| l.split('"').next()).collect();
    assert_eq!(links, ["quantities", "draws", "program", "q0", "q1"]);
    for link in links {
        assert_eq!(text.matches(&format!(" id=\"{link}\"")).count(), 1, "{link}");
    }
}

#[test]
fn a_page_of_nothing() {
    let page = page(&Page::default());
    assert!(
        page.ends_with("</html>")
            && !page.contains("<canvas")
            && !page.contains("more, in the files")
    );
    assert!(!page.contains("<section") && !page.contains("<script") && !page.contains("<h2"));
}

#[test]
fn many_quantities_are_listed_but_not_all_plotted() {
    let all: Vec<Quantity> = (0..PLOTTED + 3).map(|i| quantity(&format!("q{i}"))).collect();
    let page = page(&Page { quantities: &all, ..Page::default() });
    assert_eq!(page.matches("class=\"plots\"").count(), PLOTTED);
    assert!(page.contains("and 3 more") && page.contains("<th>q42<"));
}

/// The R-hat is next to the mean, where narrow screens show it, and wider tables scroll
/// separately while their names stay in view.
#[test]
fn the_table_fits_narrow_screens() {
    let text = page(&Page { quantities: &[quantity("pose.left_arm[2]")], ..Page::default() });
    let heads: Vec<&str> =
        text.split("<th>").skip(1).map(|h| h.split('<').next().unwrap_or("")).collect();
    assert_eq!(heads[..4], ["quantity", "mean", "sd", "R-hat"]);
    assert!(text.contains("<div class=\"wide\"><table>"));
    assert!(text.contains("pose.<wbr>left_<wbr>arm[<wbr>2]"), "names break where their parts end");
    assert!(STYLE.contains("position: sticky") && STYLE.contains("overflow-x: auto"));
    let anywhere = STYLE.lines().filter(|l| l.contains("overflow-wrap: anywhere"));
    assert!(
        anywhere.clone().all(|l| l.contains(".settings td") || l.contains("#command")),
        "letters stay together"
    );
}

/// A window 1200 pixels wide, less its scroll bar and margins, has room for three
/// pictures in a row; table heads are one line.
#[test]
fn the_style_uses_the_width() {
    let after =
        |key: &str| STYLE.split(key).nth(1).and_then(|s| s.split("px").next()?.parse::<u32>().ok());
    let (one, two) =
        (after("figure { margin: 0; flex: 0 1 ").unwrap(), after("gap: 16px; flex: 0 1 ").unwrap());
    let page = after("max-width: ").unwrap();
    assert!(
        two == 2 * one + 16 && one + 16 + two <= page.min(1200 - 15 - 2 * 15),
        "{one} {two} {page}"
    );
    assert!(
        STYLE.contains(".wide tr:first-child th { white-space: nowrap }"),
        "R-hat breaks at its hyphen"
    );
}

/// The colours follow the reader's colour scheme.
#[test]
fn the_page_has_a_dark_side() {
    let text = page(&Page { quantities: &[quantity("a")], ..Page::default() });
    assert!(text.contains("prefers-color-scheme: dark") && text.contains("content=\"light dark\""));
}
