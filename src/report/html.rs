//! `report.html`: one file that holds everything: pictures, plots, tables, the mesh to turn round, the program.

use super::encode::base64;
use super::{Quantity, number, plots, seconds};
use crate::infer::draws::KernelStats;
use std::fmt::Write;

/// What a page shows.
#[derive(Clone, Debug, Default)]
pub struct Page<'a> {
    /// The program's name.
    pub title: &'a str,
    /// Pairs of setting and value.
    pub settings: Vec<(&'a str, String)>,
    /// PNG files with their captions.
    pub pictures: Vec<(&'a str, Vec<u8>)>,
    /// The scalar quantities.
    pub quantities: &'a [Quantity],
    /// The kernels.
    pub kernels: &'a [KernelStats],
    /// What a reader should know first.
    pub warnings: &'a [String],
    /// The mesh: positions, normals, triangles.
    pub mesh: Option<MeshData<'a>>,
    /// The program's text.
    pub program: &'a str,
}

/// A mesh to turn round.
#[derive(Clone, Copy, Debug)]
pub struct MeshData<'a> {
    /// Vertices.
    pub positions: &'a [[f32; 3]],
    /// Vertices of each triangle.
    pub triangles: &'a [[u32; 3]],
}

/// Quantities that get plots.
const PLOTTED: usize = 40;

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The page.
pub fn page(p: &Page) -> String {
    let mut s = String::new();
    let title = escaped(p.title);
    let _ = write!(
        s,
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style><h1>{title}</h1>"
    );
    for w in p.warnings {
        let _ = write!(s, "<p class=\"warning\">{}</p>", escaped(w));
    }
    s.push_str("<div class=\"pictures\">");
    for (caption, png) in &p.pictures {
        let _ = write!(
            s,
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption></figure>",
            escaped(caption),
            base64(png)
        );
    }
    if let Some(m) = &p.mesh {
        s.push_str("<figure><canvas id=\"mesh\" width=\"384\" height=\"384\"></canvas><figcaption>the best draw; drag to turn it</figcaption></figure>");
        let _ = write!(s, "<script>const P={:?},T={:?};{VIEWER}</script>", rounded(m.positions), m.triangles);
    }
    s.push_str("</div><h2>Quantities</h2><table><tr><th>quantity<th>mean<th>sd<th>5%<th>median<th>95%<th>ESS bulk<th>ESS tail<th>R-hat</tr>");
    for q in p.quantities {
        let _ = write!(s, "<tr><td>{}", escaped(&q.name));
        let m = &q.summary;
        for x in [m.mean, m.sd, m.q05, m.q50, m.q95, m.ess_bulk.round(), m.ess_tail.round(), m.r_hat] {
            let _ = write!(s, "<td>{}", number(x));
        }
        s.push_str("</tr>");
    }
    s.push_str("</table><h2>Kernels</h2><table><tr><th>kernel<th>proposals<th>accepted<th>failed<th>time</tr>");
    for k in p.kernels {
        let rate = 100.0 * k.accepted as f64 / k.proposals.max(1) as f64;
        let (name, time) = (escaped(&k.name), seconds(k.seconds));
        let _ = write!(s, "<tr><td>{name}<td>{}<td>{rate:.0}%<td>{}<td>{time}</tr>", k.proposals, k.failed);
    }
    s.push_str("</table><h2>Draws</h2><p>Left: in order. Middle: their distribution. Right: ranks, level where chains agree.</p>");
    for q in p.quantities.iter().take(PLOTTED) {
        let (a, b, c) = (plots::traces(q), plots::marginal(q), plots::ranks(q));
        let _ = write!(s, "<div class=\"plots\"><b>{}</b>{a}{b}{c}</div>", escaped(&q.name));
    }
    s.push_str("<h2>Settings</h2><table>");
    for (k, v) in &p.settings {
        let _ = write!(s, "<tr><td>{}<td>{}</tr>", escaped(k), escaped(v));
    }
    let _ = write!(s, "</table><h2>Program</h2><pre>{}</pre></html>", escaped(p.program));
    s
}

/// Coordinates to a ten-thousandth: the page stays small.
fn rounded(positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    positions.iter().map(|p| p.map(|x| (x * 1e4).round() / 1e4)).collect()
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#222}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums}td,th{padding:.15em .7em;text-align:right;border-bottom:1px solid #eee}\
td:first-child,th:first-child{text-align:left}.pictures{display:flex;flex-wrap:wrap;gap:12px}figure{margin:0}img{width:384px;image-rendering:auto}\
figcaption{color:#666;font-size:13px}.warning{background:#fff4e0;border-left:4px solid #e69f00;padding:.4em .8em}\
.plots{display:flex;gap:8px;align-items:center;margin:.3em 0}.plots b{width:9em;font-weight:normal}pre{background:#f6f6f6;padding:1em;overflow:auto}canvas{background:#fafafa;cursor:grab}";

/// Draws the triangles from back to front, lit from the front.
const VIEWER: &str = "(()=>{const c=document.getElementById('mesh'),g=c.getContext('2d');let a=.5,b=.3,drag=null;\
const lo=[1/0,1/0,1/0],hi=[-1/0,-1/0,-1/0];P.forEach(p=>p.forEach((x,i)=>{lo[i]=Math.min(lo[i],x);hi[i]=Math.max(hi[i],x)}));\
const m=lo.map((x,i)=>(x+hi[i])/2),r=Math.max(...lo.map((x,i)=>hi[i]-x))/2||1;\
function draw(){const ca=Math.cos(a),sa=Math.sin(a),cb=Math.cos(b),sb=Math.sin(b);\
const Q=P.map(p=>{const x=(p[0]-m[0])/r,y=(p[1]-m[1])/r,z=(p[2]-m[2])/r,u=ca*x+sa*z,w=ca*z-sa*x;return[u,cb*y-sb*w,sb*y+cb*w]});\
g.clearRect(0,0,c.width,c.height);const S=c.width*.36,O=c.width/2;\
T.map(t=>[t,Q[t[0]][2]+Q[t[1]][2]+Q[t[2]][2]]).sort((x,y)=>x[1]-y[1]).forEach(([t])=>{const[p,q,s]=t.map(i=>Q[i]);\
const e=[q[0]-p[0],q[1]-p[1],q[2]-p[2]],f=[s[0]-p[0],s[1]-p[1],s[2]-p[2]];\
const n=[e[1]*f[2]-e[2]*f[1],e[2]*f[0]-e[0]*f[2],e[0]*f[1]-e[1]*f[0]],l=Math.hypot(...n)||1;\
const k=.25+.7*Math.abs(n[2]/l*.85+n[1]/l*.3-n[0]/l*.25);g.fillStyle=g.strokeStyle=`rgb(${90*k+40|0},${150*k+40|0},${210*k+30|0})`;\
g.beginPath();[p,q,s].forEach((v,i)=>g[i?'lineTo':'moveTo'](O+S*v[0],O-S*v[1]));g.closePath();g.fill();g.stroke()})}\
c.onpointerdown=e=>{drag=[e.clientX,e.clientY,a,b];c.setPointerCapture(e.pointerId)};c.onpointerup=()=>drag=null;\
c.onpointermove=e=>{if(drag){a=drag[2]+(e.clientX-drag[0])/120;b=drag[3]+(e.clientY-drag[1])/120;draw()}};draw()})();";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_whole_and_escapes_what_it_quotes() {
        let page = page(&Page {
            title: "a<b>.pcad",
            program: "observe x < 2 && \"s\"",
            pictures: vec![("overlay", vec![1, 2, 3])],
            mesh: Some(MeshData { positions: &[[0.0, 1.0, 2.0]; 3], triangles: &[[0, 1, 2]] }),
            settings: vec![("seed", "1".into())],
            ..Page::default()
        });
        assert!(page.contains("a&lt;b&gt;.pcad") && page.contains("x &lt; 2 &amp;&amp; &quot;s&quot;"));
        assert!(page.contains("data:image/png;base64,AQID") && page.contains("T=[[0, 1, 2]]"));
        assert!(page.ends_with("</html>") && !page.contains("http"));
    }
}
