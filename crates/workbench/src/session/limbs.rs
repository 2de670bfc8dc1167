//! Dragging limbs: the landmarks of the scene where they are in the picture, and one of them
//! pulled elsewhere. The choices of the pose that move it follow (inverse kinematics by damped
//! least squares): it goes where it is pulled, and apart from that landmarks stay where they are
//! in the picture, and choices near the values that they had when the drag began. A root, which
//! the pose hardly moves, takes all landmarks along: the other choices follow.

use super::choices::Scores;
use super::picture::{as_view, observed_image, picture_operand};
use super::state::Session;
use crate::failure::{Failure, plain};
use pcadlang_engine::lang::code::{Eager, Operand};
use pcadlang_engine::trace::{Address, Change, Draws, Given, Target, Trace};
use pcadlang_library::scene::{ImageValue, ViewValue};
use pcadlang_numerics::dist::Support;
use pcadlang_numerics::least_squares::damped_least_squares;
use pcadlang_syntax::diag::nearest;
use std::sync::Arc;

/// The tag of the choices that follow.
const POSE: &str = "pose";
/// A joint is a root if these choices move it by less than this part of what they move others.
const ROOT: f64 = 0.2;
/// How much a landmark that leaves its place counts, relative to the one that is pulled.
const OTHERS: f64 = 0.05;
/// How much a choice that leaves its value by a standard deviation counts: as if the pulled
/// landmark were this part of the picture's longer side from where it is pulled.
const CHOICES: f64 = 0.001;
/// Steps of one pull: the next one goes on from there.
const STEPS: usize = 4;
/// Maximum variables that follow.
const VARIABLES: usize = 256;
/// By how much a variable is changed to see whether it moves the joint, in its units.
const NUDGE: f64 = 0.05;

/// Landmarks of the scene in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Joints {
    /// The size of the picture that positions refer to: the photograph if there is one.
    pub size: (u32, u32),
    /// Their names with their positions, pixels; `None` for those behind the camera.
    pub positions: Vec<(Arc<str>, Option<[f64; 2]>)>,
}

/// A drag of a joint.
pub(super) struct Grab {
    joint: usize,
    name: Arc<str>,
    /// The revision of the state that it left: any other change ends the drag.
    revision: u64,
    body: Body,
    followers: Vec<Follower>,
    /// How much the other landmarks count.
    others: f64,
    /// The point of the unconstrained space at which the drag began, in units.
    begun: Vec<f64>,
    /// The landmarks at that point.
    places: Joints,
    /// The point to which the last pull led.
    point: Vec<f64>,
}

/// The scene without the observations of the program, which cost more than all the rest.
struct Body {
    trace: Trace,
    view: Operand,
    size: Option<(u32, u32)>,
    draws: Draws,
}

/// A choice that follows.
struct Follower {
    address: Address,
    target: Target,
    /// Its number of variables, and the unit of each in the unconstrained space.
    count: usize,
    unit: f64,
}

impl Joints {
    /// How far a joint is from where it is in others, and how far the farthest joint is.
    fn apart(&self, others: &Joints, joint: usize) -> [f64; 2] {
        let each = self.positions.iter().zip(&others.positions);
        let each = each.map(|((_, a), (_, b))| {
            a.zip(*b).map_or(0.0, |(a, b)| (a[0] - b[0]).abs() + (a[1] - b[1]).abs())
        });
        let each: Vec<f64> = each.collect();
        [each.get(joint).copied().unwrap_or(0.0), each.iter().copied().fold(0.0, f64::max)]
    }
}

impl Body {
    fn joints(&self) -> Option<Joints> {
        let view = as_view(self.trace.evaluated(self.view)?, None)?;
        let size = self.size.unwrap_or((view.camera().width, view.camera().height));
        let marked = ViewValue(view);
        let all = marked.landmarks(size.0, size.1).map(|(name, at)| (Arc::clone(name), at));
        Some(Joints { size, positions: all.collect() })
    }

    /// Moves the followers to a point, pending, and returns the landmarks there; `None` if the
    /// program fails there or has other choices.
    fn moved(&mut self, followers: &[Follower], point: &[f64]) -> Option<Joints> {
        let mut rest = point;
        let changes: Vec<(Target, Change)> = followers
            .iter()
            .map(|f| {
                let (own, others) = rest.split_at(f.count);
                rest = others;
                (f.target, Change::Free(own.iter().map(|x| x * f.unit).collect()))
            })
            .collect();
        let weight = self.trace.propose(&changes, self.draws).ok()?;
        (weight.appeared + weight.vanished == 0).then(|| self.joints()).flatten()
    }

    /// Returns those of some choices that move a joint, and where they are; `None` if none does,
    /// or if they move it by less than this part of what they move others.
    fn followers(
        &mut self,
        joint: usize,
        choices: &[Address],
        least: f64,
    ) -> Option<(Vec<Follower>, Vec<f64>)> {
        let (mut followers, mut begun) = (Vec::new(), Vec::new());
        let (mut own, mut all) = (0.0, 0.0);
        let here = self.joints()?;
        for address in choices {
            let Some(target) = self.trace.find(address) else { continue };
            let Some((free, _)) = self.trace.free_to_move(target) else { continue };
            let dist = self.trace.dist(target);
            let is_real = dist.as_ref().is_some_and(|d| matches!(d.support(), Support::Real));
            let sd = dist.and_then(|d| d.sd()).filter(|sd| is_real && sd.is_finite() && *sd > 0.0);
            let one = Follower {
                address: address.clone(),
                target,
                count: free.len(),
                unit: sd.unwrap_or(1.0),
            };
            let at: Vec<f64> = free.iter().map(|x| x / one.unit).collect();
            // A limb at the end of its reach moves in one direction only.
            let moves = [NUDGE, -NUDGE].map(|by| {
                let there = at.iter().map(|x| x + by).collect::<Vec<f64>>();
                let there = self.moved(std::slice::from_ref(&one), &there);
                there.map_or([0.0; 2], |there| there.apart(&here, joint))
            });
            self.trace.rollback();
            let moved: f64 = moves.iter().map(|m| m[0]).sum();
            all += moves.iter().map(|m| m[1]).sum::<f64>();
            own += moved;
            if moved > 1e-6 && begun.len() + at.len() <= VARIABLES {
                begun.extend(at);
                followers.push(one);
            }
        }
        (!followers.is_empty() && own >= least * all).then_some((followers, begun))
    }
}

impl Session {
    /// Returns the landmarks of the present scene; none if it has no view.
    pub fn joints(&mut self) -> Joints {
        let size = self.photo_size();
        let view = self.view().map(ViewValue);
        let of = |v: &ViewValue| size.unwrap_or((v.0.camera().width, v.0.camera().height));
        let size = view.as_ref().map_or((1, 1), of);
        let all = view.iter().flat_map(|v| v.landmarks(size.0, size.1));
        Joints { size, positions: all.map(|(name, at)| (Arc::clone(name), at)).collect() }
    }

    fn photo_size(&self) -> Option<(u32, u32)> {
        let image = observed_image(self.model.code())?;
        image.downcast::<ImageValue>()?.as_photo().map(|p| (p.width(), p.height()))
    }

    /// Pulls a joint to a position in the picture, pixels as in [`Session::joints`]. With
    /// `joins`, the drag of this joint goes on, and is undone together with what came before.
    ///
    /// # Errors
    /// If there is no such joint in the picture, if no choice moves it, or if the state would
    /// have probability zero; nothing has changed then.
    pub fn pull(&mut self, joint: &str, to: [f64; 2], joins: bool) -> Result<Scores, Failure> {
        if !to.iter().all(|x| x.is_finite()) {
            return Err(plain("`at` needs two numbers"));
        }
        let goes_on = |g: &Grab| joins && &*g.name == joint && g.revision == self.clock;
        let (mut grab, past) = match self.grab.take().filter(goes_on) {
            Some(grab) => (grab, None),
            None => (self.grab(joint)?, Some(self.remember(&format!("drag of {joint}")))),
        };
        self.clock += 1;
        self.dragged = None;
        let given = grab.pulled(to);
        let done = self.give(&given);
        // Where the joint cannot be does not end a drag, but none begins there.
        if done.is_ok() || past.is_none() {
            grab.revision = self.clock;
            self.grab = Some(grab);
        }
        let (_, after) = done?;
        if let Some(past) = past {
            self.keep(past);
        }
        Ok(after)
    }

    fn grab(&mut self, joint: &str) -> Result<Grab, Failure> {
        let model = (*self.program).clone().eager(Eager::NamesOnly).compile()?;
        let mut trace = self.moved_to(&model, &self.trace)?;
        let draws = self.looks();
        let none = || plain("the program has no view").hint("let view = scene.render(solid);");
        let view = picture_operand(&mut trace, draws).ok_or_else(none)?;
        let mut body = Body { trace, view, size: self.photo_size(), draws };
        let places = body.joints().ok_or_else(none)?;
        let names = || places.positions.iter().map(|(name, _)| &**name);
        let Some(number) = names().position(|n| n == joint) else {
            let failure = plain(format!("there is no joint `{joint}`"));
            return Err(match nearest(joint, names()) {
                Some(n) => failure.hint(format!("did you mean `{n}`?")),
                None => failure.hint("`joints` lists the landmarks of the scene"),
            });
        };
        let marks = self.marks();
        let choices: Vec<Address> = self
            .trace
            .all_targets()
            .iter()
            .map(|t| self.trace.address(*t))
            .filter(|a| {
                let name = a.to_string();
                !marks.forced.contains(&name) && !marks.frozen.contains(&name)
            })
            .collect();
        let of_pose = marks.tags.get(POSE).cloned().unwrap_or_default();
        let (pose, rest): (Vec<Address>, Vec<Address>) =
            choices.into_iter().partition(|a| of_pose.contains(&a.to_string()));
        let ((followers, begun), others) = [(pose, ROOT, OTHERS), (rest, 0.0, 0.0)]
            .iter()
            .find_map(|(of, least, others)| Some((body.followers(number, of, *least)?, *others)))
            .ok_or_else(|| plain(format!("no choice of the program moves `{joint}`")))?;
        let (joint, name, point) = (number, Arc::from(joint), begun.clone());
        let revision = self.clock;
        Ok(Grab { joint, name, revision, body, followers, others, begun, places, point })
    }
}

impl Grab {
    /// Returns values of the followers that bring the joint nearer to a position.
    fn pulled(&mut self, to: [f64; 2]) -> Vec<(Address, Given)> {
        let Grab { joint, body, followers, others, begun, places, point, .. } = self;
        let longer = f64::from(places.size.0.max(places.size.1));
        let residuals = |point: &[f64]| {
            let there = body.moved(followers, point)?;
            there.positions.get(*joint)?.1?;
            let goals = places.positions.iter().enumerate().map(|(i, (_, before))| {
                if i == *joint { (Some(to), 1.0) } else { (*before, *others) }
            });
            let misses = there.positions.iter().zip(goals).flat_map(|((_, at), (goal, weight))| {
                at.zip(goal).map_or([0.0; 2], |(a, g)| [0, 1].map(|c| weight * (a[c] - g[c])))
            });
            let stays = point.iter().zip(&*begun).map(|(x, b)| CHOICES * longer * (x - b));
            Some(misses.chain(stays).collect())
        };
        if let Some(found) = damped_least_squares(residuals, point, STEPS) {
            *point = found;
        }
        body.moved(followers, point);
        let stored = |f: &Follower| body.trace.stored(f.target);
        let given = followers.iter().filter_map(|f| Some((f.address.clone(), stored(f)?)));
        let given = given.map(|(address, value)| (address, Given::Stored(value))).collect();
        body.trace.rollback();
        given
    }
}
