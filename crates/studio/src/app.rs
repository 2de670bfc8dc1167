//! Does what the page asks: every method of the protocol, by the sessions of the prompt and
//! the runs of `pcadlang run`.

use super::examples;
use super::folder::Folder;
use super::guess;
use super::protocol::HintJson;
use super::protocol::{self, Call, StateName, Viewpoint};
use super::results::{self, finite};
use super::runs::Runs;
use super::server::Answer;
use super::sessions::{OpenSession, Sessions, job_of, suited, without_data};
use pcadlang_engine::lang::builtins::data::Json;
use pcadlang_engine::lang::value::Located;
use pcadlang_engine::trace::{Stop, Trace};
use pcadlang_library::scene::ImageValue;
use pcadlang_report::embedded;
use pcadlang_report::pictures::png;
use pcadlang_runs::failure::{Failure, plain};
use pcadlang_runs::hint::HintArgs;
use pcadlang_runs::reopening::reopened::Reopened;
use pcadlang_runs::scene;
use pcadlang_runs::{files, inputs};
use pcadlang_scene::render::{Camera, View};
use pcadlang_workbench::session::{
    ChoiceRow, Joints, Layer, Marks, Request, Scores, observed_image, to_json,
};
use serde::Deserialize as _;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;
use tokio::sync::broadcast;

/// Maximum choices in one answer.
const CHOICES: usize = 2000;
/// The longer side of pictures, in pixels.
const SIDES: std::ops::RangeInclusive<u32> = 16..=2048;

/// The state that the tabs of all browsers share.
pub struct App {
    /// The opened folder.
    pub folder: Folder,
    /// The open sessions.
    pub sessions: Sessions,
    /// The runs.
    pub runs: Runs,
    /// Events for every page.
    pub events: broadcast::Sender<String>,
}

impl App {
    /// Does what is asked, which may take as long as the program does.
    pub fn answer(&self, call: Call) -> Result<Answer, Failure> {
        let json = match call {
            Call::Folder(_) => self.described(),
            Call::Read(r) => json!({ "text": self.folder.read(&r.file)? }),
            Call::Write(w) => {
                self.folder.write(&w.file, &w.text)?;
                self.tell(json!({ "event": "folder" }));
                json!({})
            }
            Call::Example(e) => {
                let bytes = examples::bytes(&e.picture)?;
                let file = self.folder.store_picture(&e.picture, bytes)?;
                self.tell(json!({ "event": "folder" }));
                json!({ "file": file })
            }
            Call::Evaluation(e) => self.folder.evaluation(&e.folder)?,
            Call::Open(o) => self.open(&o)?,
            Call::Describe(s) => self.session(s.session)?,
            Call::Close(c) => {
                self.sessions.close(c.session)?;
                self.tell(json!({ "event": "closed", "session": c.session }));
                json!({})
            }
            Call::Replace(r) => {
                self.permit(r.photo.as_slice())?;
                let photo = r.photo;
                self.change(r.session, move |open| open.replace(&r.text, photo, Stop::default()))?
            }
            Call::Observe(o) => {
                self.permit(&o.observe)?;
                self.change(o.session, move |open| open.observe(o.observe, Stop::default()))?
            }
            Call::Hint(h) => {
                let hint = self.hinted(h.hint)?;
                self.change(h.session, move |open| open.hint(hint, Stop::default()))?
            }
            Call::Guess(g) => {
                let photo = self.sessions.get(g.session)?.photo();
                guess::of(photo.as_ref(), &self.hinted(g.hint)?.read()?, g.quick)?
            }
            Call::Enter(e) => self.enter(e.session, e.text)?,
            Call::Interrupt(i) => {
                self.sessions.get(i.session)?.interrupt();
                json!({})
            }
            Call::Choices(c) => self.choices(c)?,
            Call::Assign(a) => self.assign(a)?,
            Call::JointsOf(j) => self.sessions.get(j.session)?.ask(|open| {
                let found = open.session.joints();
                let (width, height) = found.size;
                Ok(json!({ "width": width, "height": height, "joints": joints(&found) }))
            })?,
            Call::Pull(p) => self.pull(p)?,
            Call::Why(w) => {
                let text = format!(":why {}", w.address);
                let handle = self.sessions.get(w.session)?;
                let said = handle.ask(move |open| Ok(open.session.enter(&text)?.text))?;
                json!({ "text": said })
            }
            Call::Complete(c) => {
                let handle = self.sessions.get(c.session)?;
                let found = handle.ask(move |open| Ok(open.session.complete(&c.text, c.at)))?;
                let words: Vec<Value> = found.words.iter().map(|w| json!({ "word": w })).collect();
                json!({ "from": found.start, "words": words })
            }
            Call::Begin(b) => self.begin(b)?,
            Call::Pause(r) => {
                let run = self.runs.get(&r.run)?;
                run.pause()?;
                self.tell_run(run.described())
            }
            Call::GoOn(r) => {
                let run = self.runs.go_on(&r.run)?;
                self.tell_run(run.described())
            }
            Call::Stop(r) => {
                let run = self.runs.get(&r.run)?;
                run.stop()?;
                self.tell_run(run.described())
            }
            Call::Runs(_) => json!({ "runs": self.runs.described() }),
            Call::Remove(r) => {
                self.runs.remove(&r.run)?;
                json!({})
            }
            Call::Kept(r) => results::kept(&*self.runs.get(&r.run)?)?,
            Call::Summary(r) => results::summary(&*self.runs.get(&r.run)?)?,
            Call::Quantity(q) => results::quantity(&*self.runs.get(&q.run)?, &q.names)?,
            Call::Compare(c) => results::compared(&*self.runs.get(&c.a)?, &*self.runs.get(&c.b)?)?,
            Call::Export(e) => {
                let run = self.runs.get(&e.run)?;
                let file = super::results::export(&run, &e.kind)?;
                json!({ "file": format!("{}/{file}", run.name) })
            }
            Call::Picture(p) => return self.picture(p),
            Call::Mesh(m) => return self.mesh(&m),
            Call::CameraOf(c) => {
                self.with_view(&c.state, |view, _| Ok(embedded::camera(view.camera())))?
            }
        };
        Ok(json.into())
    }

    /// Checks that observed files are of the opened folder.
    fn permit(&self, observe: &[String]) -> Result<(), Failure> {
        observe.iter().try_for_each(|spec| self.folder.file(inputs::file_of(spec)).map(|_| ()))
    }

    /// Returns the arguments of a command that give a hint, whose mask must be of the opened
    /// folder.
    fn hinted(&self, hint: HintJson) -> Result<HintArgs, Failure> {
        if let Some(mask) = &hint.mask {
            self.folder.file(&mask.to_string_lossy())?;
        }
        Ok(hint.arguments())
    }

    /// Sends an event to every page.
    pub fn tell(&self, event: Value) {
        // Nobody listens if no page is open.
        let _ = self.events.send(event.to_string());
    }

    fn tell_run(&self, run: Value) -> Value {
        self.tell(json!({ "event": "run", "run": run }));
        run
    }

    fn tell_session(&self, id: u64, said: Value) -> Value {
        self.tell(json!({ "event": "session", "session": id, "revision": said["revision"] }));
        said
    }

    fn described(&self) -> Value {
        let mut out = self.folder.described();
        out["version"] = json!(env!("CARGO_PKG_VERSION"));
        out["folder"] = json!(self.folder.path().file_name().and_then(|n| n.to_str()));
        out["runs"] = json!(self.runs.described());
        out["sessions"] = json!(self.sessions.ids());
        out["threads"] = json!(pcadlang_runs::job::machine_threads());
        out
    }

    fn open(&self, o: &protocol::Open) -> Result<Value, Failure> {
        let handle = match (&o.program, &o.run) {
            (Some(program), None) => {
                self.folder.file(program)?;
                self.permit(&o.observe)?;
                self.permit(o.photo.as_slice())?;
                let mut job = job_of(program, &o.set, &o.observe);
                let read = inputs::program_of(&job, true)?;
                job.observe.extend(suited(&read, &[], o.photo.as_deref()));
                match self.sessions.open(job.clone(), None) {
                    Ok(handle) => handle,
                    Err(failure) => return without_data(read, &job, failure),
                }
            }
            (None, Some(run)) => {
                let run = Reopened::open(&self.runs.get(run)?.folder)?;
                self.sessions.open(run.job.clone(), Some(run))?
            }
            _ => return Err(plain("`open` needs either a program or a run")),
        };
        let id = handle.id;
        let said = handle.ask(move |open| Ok(open.described(id)))?;
        self.tell(json!({ "event": "opened", "session": id, "program": said["program"] }));
        Ok(said)
    }

    fn session(&self, id: u64) -> Result<Value, Failure> {
        self.sessions.get(id)?.ask(move |open| Ok(open.described(id)))
    }

    /// Changes a session, tells all pages, and describes it.
    fn change(
        &self,
        id: u64,
        f: impl FnOnce(&mut OpenSession) -> Result<(), Failure> + Send + 'static,
    ) -> Result<Value, Failure> {
        let said = self.sessions.get(id)?.ask(move |open| {
            f(open)?;
            Ok(open.described(id))
        })?;
        Ok(self.tell_session(id, said))
    }

    fn enter(&self, id: u64, text: String) -> Result<Value, Failure> {
        let handle = self.sessions.get(id)?;
        let (said, opens) = handle.ask(move |open| {
            let reply = open.session.enter(&text)?;
            let (mut confirm, mut opens) = (Value::Null, None);
            match reply.request {
                Some(Request::Confirm { question, then }) => {
                    confirm = json!({ "question": question, "then": then });
                }
                Some(Request::Open(folder)) => opens = Some(folder),
                Some(Request::Edit) => {
                    return Err(plain("the program is in the editor beside the prompt"));
                }
                None => {}
            }
            if let Some((picture, file)) =
                reply.picture.as_ref().and_then(|p| Some((p, p.file.as_ref()?)))
            {
                let bytes = png(&picture.pixels()).map_err(|e| plain(e.to_string()))?;
                files::write(file, &bytes)?;
            }
            let said = json!({
                "text": reply.text, "picture": reply.picture.is_some(), "clears": reply.clears,
                "ends": reply.ends, "confirm": confirm, "revision": open.session.revision(),
            });
            Ok((said, opens))
        })?;
        if let Some(folder) = opens {
            let name = folder.to_string_lossy().into_owned();
            let run = Reopened::open(&self.runs.get(&name)?.folder)?;
            handle.ask(move |open| open.load(&run, Stop::default()))?;
        }
        Ok(self.tell_session(id, said))
    }

    fn choices(&self, c: protocol::Choices) -> Result<Value, Failure> {
        let (from, count) = (c.from, c.count.unwrap_or(CHOICES).min(CHOICES));
        let wanted = c.select.unwrap_or_default();
        let listed = move |trace: &Trace, rates: &BTreeMap<String, f64>, marks: &Marks| {
            let mut all = ChoiceRow::all(trace);
            all.retain(|c| c.address.contains(&wanted));
            let total = all.len();
            let rows: Vec<Value> =
                all.iter().skip(from).take(count).map(|c| row(c, rates, marks)).collect();
            let observed = trace.observations();
            let observed = observed.iter().take(CHOICES);
            let observed = observed
                .map(|(a, s)| json!({ "address": a.to_string(), "log_density": finite(*s) }));
            let mut out = scores(Scores::of(trace));
            out["total"] = json!(total);
            out["choices"] = json!(rows);
            out["observed"] = json!(observed.collect::<Vec<_>>());
            out
        };
        match (&c.state.session, &c.state.run) {
            (Some(id), None) => {
                let rates =
                    self.runs.of_session(*id).map(|r| results::acceptance(&r)).unwrap_or_default();
                self.sessions.get(*id)?.ask(move |open| {
                    let marks = open.session.marks();
                    let mut out = listed(open.session.trace(), &rates, &marks);
                    out["revision"] = json!(open.session.revision());
                    Ok(out)
                })
            }
            (None, Some(run)) => {
                let run = self.runs.get(run)?;
                let state = run.state(&c.state)?;
                Ok(listed(&state.trace, &results::acceptance(&run), &Marks::default()))
            }
            _ => Err(no_state()),
        }
    }

    fn assign(&self, a: protocol::Assign) -> Result<Value, Failure> {
        let Json(value) = Json::deserialize(a.value).map_err(|e| plain(e.to_string()))?;
        let id = a.session;
        let said = self.sessions.get(id)?.ask(move |open| {
            let after = open.session.assign(&a.address, value, a.drag)?;
            let mut out = scores(after);
            out["revision"] = json!(open.session.revision());
            Ok(out)
        })?;
        Ok(self.tell_session(id, said))
    }

    fn pull(&self, p: protocol::Pull) -> Result<Value, Failure> {
        let id = p.session;
        let said = self.sessions.get(id)?.ask(move |open| {
            let mut out = scores(open.session.pull(&p.joint, p.at, p.drag)?);
            out["revision"] = json!(open.session.revision());
            out["joints"] = joints(&open.session.joints());
            Ok(out)
        })?;
        Ok(self.tell_session(id, said))
    }

    fn begin(&self, b: protocol::Begin) -> Result<Value, Failure> {
        let folder = self.folder.path().to_owned();
        let job = self.sessions.get(b.session)?.ask(move |open| {
            open.check_data()?;
            open.write_program(&folder)?;
            Ok(open.job.clone())
        })?;
        let run = self.runs.begin(job, &b.settings, b.session)?;
        Ok(self.tell_run(run.described()))
    }

    fn picture(&self, p: protocol::Picture) -> Result<Answer, Failure> {
        let layer = Layer::ALL.into_iter().find(|l| l.name() == p.layer);
        let layer = layer.ok_or_else(|| {
            let names: Vec<&str> = Layer::ALL.iter().map(|l| l.name()).collect();
            let problem = plain(format!("there is no layer `{}`", p.layer));
            problem.hint(format!("one of {}", names.join(", ")))
        })?;
        if let (None, Some(run)) = (&p.state.session, &p.state.run) {
            let (header, data) = self.runs.get(run)?.picture(&p.state, layer, p.size, p.camera)?;
            return Ok(Answer::Bytes(header, data));
        }
        let id = p.state.session.ok_or_else(no_state)?;
        let (header, data) = self.sessions.get(id)?.ask(move |open| {
            let view = open.session.view().ok_or_else(no_view)?;
            let image = observed_image(open.session.model().code());
            let image = image.as_ref().and_then(|i| i.downcast::<ImageValue>());
            let located = open.session.trace().located();
            let (mut header, data) = picture(&view, image, &located, layer, p.size, p.camera)?;
            header.insert("log_joint".into(), finite(open.session.trace().log_joint()));
            header.insert("revision".into(), json!(open.session.revision()));
            Ok((header, data))
        })?;
        Ok(Answer::Bytes(header, Arc::new(data)))
    }

    fn mesh(&self, m: &protocol::Mesh) -> Result<Answer, Failure> {
        let limit = m.limit;
        let (header, data) = self.with_view(&m.state, move |view, log_joint| {
            let (mut header, data) = results::mesh(view.solid(), limit).map_err(plain)?;
            header.insert("log_joint".into(), finite(log_joint));
            Ok((header, data))
        })?;
        Ok(Answer::Bytes(header, Arc::new(data)))
    }

    /// Does something with the view of a state and its log joint density.
    fn with_view<T: Send + 'static>(
        &self,
        name: &StateName,
        f: impl FnOnce(&Arc<View>, f64) -> Result<T, Failure> + Send + 'static,
    ) -> Result<T, Failure> {
        match (name.session, &name.run) {
            (Some(id), None) => self.sessions.get(id)?.ask(move |open| {
                let view = open.session.view().ok_or_else(no_view)?;
                f(&view, open.session.trace().log_joint())
            }),
            (None, Some(run)) => {
                let mut state = self.runs.get(run)?.state(name)?;
                let log_joint = state.trace.log_joint();
                let view = scene::view(&mut state.trace, scene::predictive(0, 0), None);
                f(&view.ok_or_else(no_view)?, log_joint)
            }
            _ => Err(no_state()),
        }
    }
}

/// The message where nothing can be drawn.
pub fn no_view() -> Failure {
    plain("the program has no view and no solid").hint("let view = scene.render(solid);")
}

/// Draws a picture of a scene as a file, with its header.
pub fn picture(
    view: &Arc<View>,
    image: Option<&ImageValue>,
    located: &[Located],
    layer: Layer,
    size: u32,
    camera: Option<Viewpoint>,
) -> Result<(Map<String, Value>, Vec<u8>), Failure> {
    if !SIDES.contains(&size) {
        return Err(plain(format!("`size` must be from {} to {}", SIDES.start(), SIDES.end())));
    }
    // From elsewhere the photograph does not lie behind the scene.
    let drawn = match camera {
        Some(viewpoint) => {
            let camera = seen_from(viewpoint, view.camera())?;
            let view = Arc::new(View::new(view.solid().clone(), camera));
            layer.draw(&view, None, &[], size)?
        }
        None => layer.draw(view, image, located, size)?,
    };
    let bytes = encoded(&drawn)?;
    let mut header = Map::new();
    header.insert("type".into(), json!("image/png"));
    header.insert("width".into(), json!(drawn.width()));
    header.insert("height".into(), json!(drawn.height()));
    Ok((header, bytes))
}

/// Encodes a picture as PNG at the least effort: the way to the page is short, and that takes
/// a fraction of the time of JPEG.
fn encoded(picture: &image::RgbImage) -> Result<Vec<u8>, Failure> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Sub);
    picture.write_with_encoder(encoder).map_err(|e| plain(e.to_string()))?;
    Ok(bytes)
}

/// Returns a camera at a viewpoint, with the size of another one's pictures.
fn seen_from(v: Viewpoint, other: &Camera) -> Result<Camera, Failure> {
    use glam::DVec3;
    let wrong = || {
        plain(
            "`camera` needs an eye, another target, and an up that is not the direction between them",
        )
    };
    let places = [v.eye, v.target, v.up].map(DVec3::from_array);
    if !places[0].is_finite() || !(1.0..=170.0).contains(&v.fov_y) {
        return Err(wrong());
    }
    let focal_px = 0.5 * f64::from(other.height) / (0.5 * v.fov_y.to_radians()).tan();
    Camera::looking_at(places, focal_px, (other.width, other.height)).ok_or_else(wrong)
}

fn no_state() -> Failure {
    plain("`state` needs either a session or a run")
}

fn scores(s: Scores) -> Value {
    json!({
        "log_joint": finite(s.joint), "log_prior": finite(s.prior),
        "log_likelihood": finite(s.likelihood),
    })
}

fn joints(found: &Joints) -> Value {
    let seen = found.positions.iter().filter_map(|(name, at)| Some((name, (*at)?)));
    seen.map(|(name, at)| json!({ "name": &**name, "at": at })).collect()
}

fn row(c: &ChoiceRow, rates: &BTreeMap<String, f64>, marks: &Marks) -> Value {
    let tags = marks.tags.iter().filter(|(_, of)| of.contains(&c.address)).map(|(tag, _)| tag);
    json!({
        "address": c.address, "value": to_json(&c.value), "text": c.text(), "family": c.family,
        "log_density": finite(c.log_density), "support": c.support, "low": c.bounds[0],
        "high": c.bounds[1], "scale": c.scale, "acceptance": rates.get(&c.address),
        "tags": tags.collect::<Vec<_>>(), "forced": marks.forced.contains(&c.address),
        "frozen": marks.frozen.contains(&c.address),
    })
}
