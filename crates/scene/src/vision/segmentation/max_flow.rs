//! The smallest cut of a grid of pixels between two terminals, the object and what is beside
//! it, by growing a search tree from each (Boykov & Kolmogorov 2004, "An experimental
//! comparison of min-cut/max-flow algorithms for energy minimization in vision", PAMI 26,
//! 1124-1137). Every pixel has eight neighbours.

use std::collections::VecDeque;

/// A grid of pixels with the weights of its edges.
#[derive(Clone)]
pub struct Grid {
    /// The number of columns, with one more at each side that belongs to no pixel.
    stride: usize,
    width: usize,
    height: usize,
    /// What can still flow to each neighbour.
    left: Vec<[i32; 8]>,
}

/// Columns and rows to the neighbours; the opposite of neighbour `k` is `7 - k`.
const NEIGHBOURS: [[isize; 2]; 8] =
    [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Tree {
    None,
    Object,
    Beside,
}

/// How a pixel hangs in its tree.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Parent {
    None,
    Terminal,
    Neighbour(u8),
}

impl Grid {
    /// A grid of pixels in row-major order. `apart(p, q)` is what it costs to part two
    /// neighbours, at least 0.
    pub fn new(width: usize, height: usize, apart: impl Fn(usize, usize) -> i32) -> Grid {
        let stride = width + 2;
        let mut grid = Grid { stride, width, height, left: vec![[0; 8]; stride * (height + 2)] };
        for p in 0..width * height {
            let node = grid.node(p);
            for (k, [dx, dy]) in NEIGHBOURS.iter().enumerate().skip(4) {
                let (i, j) = ((p % width) as isize + dx, (p / width) as isize + dy);
                if i < 0 || i >= width as isize || j >= height as isize {
                    continue;
                }
                let weight = apart(p, j as usize * width + i as usize);
                let other = grid.step(node, k);
                grid.left[node][k] = weight;
                grid.left[other][7 - k] = weight;
            }
        }
        grid
    }

    fn node(&self, p: usize) -> usize {
        (p / self.width + 1) * self.stride + p % self.width + 1
    }

    fn step(&self, node: usize, k: usize) -> usize {
        let [dx, dy] = NEIGHBOURS[k];
        (node as isize + dy * self.stride as isize + dx) as usize
    }

    /// Returns the pixels on the object's side of the smallest cut: those that can still be
    /// reached from the object. `terminal` is what calling a pixel background costs more than
    /// calling it object.
    pub fn object(&self, terminal: &[i32]) -> Vec<bool> {
        let mut nodes = vec![0; self.left.len()];
        let pixels = 0..self.width * self.height;
        pixels.clone().for_each(|p| nodes[self.node(p)] = terminal[p]);
        let trees = Search::new(self.clone(), nodes).finished();
        pixels.map(|p| trees[self.node(p)] == Tree::Object).collect()
    }
}

/// The two trees while they grow.
struct Search {
    grid: Grid,
    /// What can still flow from or to a terminal, above 0 from the object.
    terminal: Vec<i32>,
    tree: Vec<Tree>,
    parent: Vec<Parent>,
    /// When the distance to the terminal was last known, and that distance.
    known: Vec<(u32, u32)>,
    now: u32,
    active: VecDeque<usize>,
    waiting: Vec<bool>,
    orphans: VecDeque<usize>,
}

impl Search {
    fn new(grid: Grid, terminal: Vec<i32>) -> Search {
        let n = terminal.len();
        let mut search = Search {
            tree: vec![Tree::None; n],
            parent: vec![Parent::None; n],
            known: vec![(0, 0); n],
            now: 0,
            active: VecDeque::new(),
            waiting: vec![false; n],
            orphans: VecDeque::new(),
            grid,
            terminal,
        };
        for node in 0..n {
            let terminal = search.terminal[node];
            if terminal != 0 {
                search.tree[node] = if terminal > 0 { Tree::Object } else { Tree::Beside };
                search.parent[node] = Parent::Terminal;
                search.known[node] = (0, 1);
                search.activate(node);
            }
        }
        search
    }

    fn activate(&mut self, node: usize) {
        if !self.waiting[node] {
            self.waiting[node] = true;
            self.active.push_back(node);
        }
    }

    /// What can flow from a node's parent to it, or from it to its parent: in the direction
    /// of the flow between the terminals.
    fn room(&self, tree: Tree, node: usize, towards: usize) -> i32 {
        match tree {
            Tree::Object => self.grid.left[self.grid.step(node, towards)][7 - towards],
            _ => self.grid.left[node][towards],
        }
    }

    fn finished(mut self) -> Vec<Tree> {
        while let Some(node) = self.active.front().copied() {
            if self.tree[node] == Tree::None {
                self.active.pop_front();
                self.waiting[node] = false;
                continue;
            }
            match self.grow(node) {
                Some((from, k)) => {
                    self.now += 1;
                    self.augment(from, k);
                    while let Some(orphan) = self.orphans.pop_front() {
                        self.adopt(orphan);
                    }
                }
                None => {
                    self.active.pop_front();
                    self.waiting[node] = false;
                }
            }
        }
        self.tree
    }

    /// Lets a node's tree take its free neighbours. Returns where it meets the other tree:
    /// a node of the object's tree and the neighbour that is of the other.
    fn grow(&mut self, node: usize) -> Option<(usize, usize)> {
        let tree = self.tree[node];
        for k in 0..8 {
            let room = match tree {
                Tree::Object => self.grid.left[node][k],
                _ => self.grid.left[self.grid.step(node, k)][7 - k],
            };
            if room == 0 {
                continue;
            }
            let other = self.grid.step(node, k);
            let (at, away) = self.known[node];
            if self.tree[other] == Tree::None {
                self.tree[other] = tree;
                self.parent[other] = Parent::Neighbour(7 - k as u8);
                self.known[other] = (at, away + 1);
                self.activate(other);
            } else if self.tree[other] != tree {
                return Some(if tree == Tree::Object { (node, k) } else { (other, 7 - k) });
            } else if self.known[other].0 <= at && self.known[other].1 > away + 1 {
                // A shorter way to the terminal.
                self.parent[other] = Parent::Neighbour(7 - k as u8);
                self.known[other] = (at, away + 1);
            }
        }
        None
    }

    /// Sends what fits along the path through the meeting of the trees.
    fn augment(&mut self, from: usize, k: usize) {
        let to = self.grid.step(from, k);
        let mut flow = self.grid.left[from][k];
        for end in [from, to] {
            let (tree, mut node) = (self.tree[end], end);
            while let Parent::Neighbour(towards) = self.parent[node] {
                flow = flow.min(self.room(tree, node, usize::from(towards)));
                node = self.grid.step(node, usize::from(towards));
            }
            flow = flow.min(self.terminal[node].abs());
        }
        self.grid.left[from][k] -= flow;
        self.grid.left[to][7 - k] += flow;
        for end in [from, to] {
            let (tree, mut node) = (self.tree[end], end);
            while let Parent::Neighbour(towards) = self.parent[node] {
                let towards = usize::from(towards);
                let next = self.grid.step(node, towards);
                let (source, way, target) = match tree {
                    Tree::Object => (next, 7 - towards, node),
                    _ => (node, towards, next),
                };
                self.grid.left[source][way] -= flow;
                self.grid.left[target][7 - way] += flow;
                if self.grid.left[source][way] == 0 {
                    self.parent[node] = Parent::None;
                    self.orphans.push_back(node);
                }
                node = next;
            }
            let terminal = &mut self.terminal[node];
            *terminal -= terminal.signum() * flow;
            if *terminal == 0 {
                self.parent[node] = Parent::None;
                self.orphans.push_back(node);
            }
        }
    }

    /// Finds a new parent in its tree for a node that has lost its own, or frees it.
    fn adopt(&mut self, node: usize) {
        let tree = self.tree[node];
        let mut best: Option<(u32, usize)> = None;
        for k in 0..8 {
            let other = self.grid.step(node, k);
            if self.tree[other] != tree || self.room(tree, node, k) == 0 {
                continue;
            }
            if let Some(away) = self.distance(other)
                && best.is_none_or(|(least, _)| away < least)
            {
                best = Some((away, k));
            }
        }
        if let Some((away, k)) = best {
            self.parent[node] = Parent::Neighbour(k as u8);
            self.known[node] = (self.now, away + 1);
            return;
        }
        for k in 0..8 {
            let other = self.grid.step(node, k);
            if self.tree[other] != tree {
                continue;
            }
            if self.room(tree, node, k) > 0 {
                self.activate(other);
            }
            if self.parent[other] == Parent::Neighbour(7 - k as u8) {
                self.parent[other] = Parent::None;
                self.orphans.push_back(other);
            }
        }
        self.tree[node] = Tree::None;
    }

    /// Returns the distance of a node to its terminal, if it still hangs on it, and notes it
    /// along the way.
    fn distance(&mut self, node: usize) -> Option<u32> {
        let (mut at, mut steps) = (node, 0);
        let end = loop {
            if self.known[at].0 == self.now {
                break self.known[at].1;
            }
            match self.parent[at] {
                Parent::None => return None,
                Parent::Terminal => break 1,
                Parent::Neighbour(k) => at = self.grid.step(at, usize::from(k)),
            }
            steps += 1;
        };
        let mut away = end + steps;
        let (found, mut at) = (away, node);
        while self.known[at].0 != self.now {
            self.known[at] = (self.now, away);
            away -= 1;
            match self.parent[at] {
                Parent::Neighbour(k) => at = self.grid.step(at, usize::from(k)),
                _ => break,
            }
        }
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::testing::numbers;

    /// The least cost of parting a grid, by single paths that are searched in width (Edmonds
    /// & Karp 1972).
    fn least_cost(width: usize, terminal: &[i32], apart: impl Fn(usize, usize) -> i32) -> i64 {
        let n = terminal.len();
        let mut room = vec![vec![0i32; n + 2]; n + 2];
        for p in 0..n {
            room[n][p] = terminal[p].max(0);
            room[p][n + 1] = (-terminal[p]).max(0);
            for q in 0..n {
                let near =
                    (p % width).abs_diff(q % width) <= 1 && (p / width).abs_diff(q / width) <= 1;
                if near && p != q {
                    room[p][q] = apart(p.min(q), p.max(q));
                }
            }
        }
        let mut flow = 0;
        loop {
            let mut from = vec![usize::MAX; n + 2];
            let mut queue = VecDeque::from([n]);
            from[n] = n;
            while let Some(p) = queue.pop_front() {
                for q in (0..n + 2).filter(|q| room[p][*q] > 0) {
                    if from[q] == usize::MAX {
                        from[q] = p;
                        queue.push_back(q);
                    }
                }
            }
            if from[n + 1] == usize::MAX {
                return flow;
            }
            let path: Vec<usize> =
                std::iter::successors(Some(n + 1), |q| (*q != n).then(|| from[*q])).collect();
            let least = path.windows(2).map(|e| room[e[1]][e[0]]).min().unwrap();
            for e in path.windows(2) {
                room[e[1]][e[0]] -= least;
                room[e[0]][e[1]] += least;
            }
            flow += i64::from(least);
        }
    }

    /// What a division of a grid costs.
    fn cost(
        width: usize,
        terminal: &[i32],
        apart: impl Fn(usize, usize) -> i32,
        object: &[bool],
    ) -> i64 {
        let mut sum = 0;
        for p in 0..terminal.len() {
            let wrong = if object[p] { -terminal[p] } else { terminal[p] };
            sum += i64::from(wrong.max(0));
            for q in p + 1..terminal.len() {
                let near =
                    (p % width).abs_diff(q % width) <= 1 && (p / width).abs_diff(q / width) <= 1;
                if near && object[p] != object[q] {
                    sum += i64::from(apart(p, q));
                }
            }
        }
        sum
    }

    #[test]
    fn cuts_cost_as_little_as_any() {
        let mut next = numbers(7);
        for (width, height) in [(1, 1), (1, 6), (5, 1), (2, 2), (4, 5), (7, 6), (9, 9)] {
            for strength in [3.0, 12.0, 40.0] {
                for _ in 0..20 {
                    let n = width * height;
                    let terminal: Vec<i32> =
                        (0..n).map(|_| (40.0 * next() - 20.0) as i32).collect();
                    let weights: Vec<i32> =
                        (0..n * n).map(|_| (strength * next()) as i32).collect();
                    let apart = |p: usize, q: usize| weights[p * n + q];
                    let object = Grid::new(width, height, apart).object(&terminal);
                    let found = cost(width, &terminal, apart, &object);
                    assert_eq!(found, least_cost(width, &terminal, apart), "{width} x {height}");
                }
            }
        }
    }
}
