"""Chains that people bring: closed forms, NumPy's own solver, and failures so rare that only kill rates know them."""

import unittest

import numpy as np

import metastable

try:
    import scipy.sparse
except ImportError:
    scipy = None


def some_chain(n=40, seed=2):
    rng = np.random.default_rng(seed)
    matrix = rng.random((n, n)) * (rng.random((n, n)) < 0.3) + np.eye(n)
    kill = rng.random(n) * 0.01
    return matrix / matrix.sum(axis=1, keepdims=True) * (1 - kill)[:, None], kill


class Chains(unittest.TestCase):
    def test_agree_with_dense_linear_algebra(self):
        matrix, kill = some_chain()
        chain = metastable.chain(matrix, kill)
        n = len(chain)
        inverse = np.linalg.inv(np.eye(n) - matrix)
        mean = inverse.sum(axis=1)
        passage = chain.first_passage()
        np.testing.assert_allclose(passage.mean, mean, rtol=1e-11)
        np.testing.assert_allclose(passage.sd, np.sqrt(2 * inverse @ mean - mean - mean**2), rtol=1e-9)
        self.assertEqual(passage.to_dict()["sd"], passage.sd.tolist())
        self.assertIn("<th>lower</th>", passage._repr_html_())
        self.assertTrue(np.all(passage.lower <= passage.mean) and np.all(passage.mean <= passage.upper))
        self.assertLess((passage.upper / passage.lower).max() - 1, 1e-11)
        lists = metastable.chain(matrix.tolist(), kill.tolist())
        np.testing.assert_array_equal(lists.first_passage().mean, passage.mean)
        values, vectors = np.linalg.eig(matrix.T)
        quasi = chain.quasi_stationary()
        self.assertAlmostEqual(quasi.failure_rate, 1 - values.real.max(), 12)
        left = np.abs(vectors[:, values.real.argmax()].real)
        np.testing.assert_allclose(quasi.distribution, left / left.sum(), rtol=1e-9)
        self.assertLess(quasi.distribution_error, 1e-13)
        right = np.linalg.eig(matrix)
        right = np.abs(right[1][:, right[0].real.argmax()].real)
        np.testing.assert_allclose(quasi.survival_weight, right / right.max(), rtol=1e-9)
        self.assertLess(quasi.weight_error, 1e-13)
        self.assertIsNone(quasi.unproven)
        np.testing.assert_allclose(chain.survival(3, [0, 1, 7]),
                                   [np.linalg.matrix_power(matrix, k)[3].sum() for k in (0, 1, 7)], rtol=1e-10)
        into = np.arange(n) < 3
        away = np.linalg.solve(np.eye(n - 3) - matrix[3:, 3:], matrix[3:, :3].sum(axis=1))
        np.testing.assert_allclose(chain.committor([0, 1, 2]).reach[3:], away, rtol=1e-11)
        np.testing.assert_array_equal(chain.committor(into).reach[:3], 1)

    @unittest.skipIf(scipy is None, "SciPy is not there")
    def test_large_chains_are_iterated_within_their_bounds(self):
        # All rows fail alike: 1 / k expected steps, a failure rate of k, (1 - k)^n survive.
        n, k = 6000, 1e-9
        rng = np.random.default_rng(4)
        matrix = scipy.sparse.csr_matrix((rng.random(10 * n), (np.repeat(np.arange(n), 10), rng.integers(0, n, 10 * n))),
                                         shape=(n, n))
        matrix = scipy.sparse.diags((1 - k) / np.asarray(matrix.sum(axis=1)).ravel()) @ matrix
        chain = metastable.chain(matrix, np.full(n, k))
        passage = chain.first_passage()
        np.testing.assert_allclose(passage.mean, 1 / k, rtol=1e-12)
        self.assertTrue(np.all(passage.lower <= 1 / k) and np.all(1 / k <= passage.upper))
        self.assertLess((passage.upper / passage.lower).max() - 1, 1e-9)
        quasi = chain.quasi_stationary()
        self.assertTrue(quasi.lower <= k * (1 + 1e-12) and k * (1 - 1e-12) <= quasi.upper)
        np.testing.assert_allclose(chain.survival(0, [1, 1e9, np.inf]), [1 - k, np.exp(1e9 * np.log1p(-k)), 0], rtol=1e-9)
        to = chain.committor([0])
        self.assertLess(to.error, 1e-6)
        np.testing.assert_allclose(to.reach + to.fail, 1, rtol=1e-9)
        with self.assertRaisesRegex(metastable.ComputationError, "6000 states with .* memory_gb allows 0.001"):
            metastable.chain(matrix, np.full(n, k), memory_gb=0.001)
        with self.assertRaisesRegex(metastable.ComputationError, "not done after 1e-06 s"):
            metastable.chain(matrix, np.full(n, k), time_limit=1e-6).first_passage()
        with self.assertRaisesRegex(metastable.InputError, "time_limit: a number expected, not None"):
            metastable.chain(matrix, np.full(n, k), time_limit=None)
        with self.assertRaisesRegex(metastable.InputError, "memory_gb: -1"):
            metastable.chain(matrix, np.full(n, k), memory_gb=-1)

    def test_rare_failures_keep_their_digits(self):
        # From 0 to 1 with a, back with b; only state 1 fails, with k: m0 = m1 + 1 / a, m1 = (1 + b / a) / k.
        a, b, k = 0.25, 0.5, 1e-14
        passage = metastable.chain(np.array([[0, a], [b, 0]]), [0, k]).first_passage()
        exact = (1 + b / a) / k
        np.testing.assert_allclose(passage.mean, [exact + 1 / a, exact], rtol=1e-15)
        self.assertTrue(passage.lower[1] <= exact <= passage.upper[1])
        self.assertLess(passage.upper[1] / passage.lower[1] - 1, 1e-3)

    @unittest.skipIf(scipy is None, "SciPy is not there")
    def test_any_sparse_format_is_the_same_chain(self):
        matrix, kill = some_chain()
        dense = metastable.chain(matrix, kill).first_passage().mean
        for kind in ("csr", "csc", "coo", "lil"):
            sparse = metastable.chain(scipy.sparse.coo_matrix(matrix).asformat(kind), kill)
            np.testing.assert_array_equal(sparse.first_passage().mean, dense)

    def test_equal_kill_rates_leave_the_exchange_alone(self):
        for stay in (np.array([[.98, .01], [.001, .989]]), np.array([[.98999, 1e-5], [1e-6, .989999]])):
            quasi = metastable.chain(stay, [.01, .01]).quasi_stationary()
            np.testing.assert_allclose(quasi.distribution, [1 / 11, 10 / 11], rtol=1e-9)
            self.assertEqual(quasi.failure_rate, .01)

    def test_a_cyclic_chain_has_the_eigenvector_of_the_whole(self):
        matrix = np.array([[0, 1.], [.9, 0]])
        quasi = metastable.chain(matrix, [0, .1]).quasi_stationary()
        self.assertAlmostEqual(quasi.distribution.sum(), 1, 14)
        after = quasi.distribution @ matrix
        np.testing.assert_allclose(after, (1 - quasi.failure_rate) * quasi.distribution, rtol=1e-14)

    def test_the_distribution_has_a_bound_or_a_reason(self):
        # Both groups of two states change places by c, each state fails with its group's rate: a chain of two states.
        c, slow, fast = 1e-10, 1e-12, 3e-12
        matrix = np.array([[0, .5, c, 0], [.5, 0, c, 0], [c, 0, 0, .5], [c, 0, .5, 0]])
        quasi = metastable.chain(matrix, [slow, slow, fast, fast]).quasi_stationary()
        half = (fast - slow) / 2
        weight = half + np.hypot(half, c)  # of the slow group, where the fast one has c
        share = weight / (weight + c)
        error = abs(quasi.distribution[:2].sum() - share)
        self.assertLessEqual(error, quasi.distribution_error + 1e-15)
        self.assertTrue(1e-15 < quasi.distribution_error < 1e-6)
        passing = metastable.chain([[0, .5], [0, 0]], [.5, 1]).quasi_stationary()
        self.assertIsNone(passing.distribution_error)
        self.assertIsNone(passing.weight_error)
        self.assertRegex(passing.unproven, "no state is visited twice")

    def test_what_is_not_unique_is_said(self):
        with self.assertRaisesRegex(metastable.ComputationError, "not unique"):
            metastable.chain(np.diag([.9, .9]), [.1, .1]).quasi_stationary()

    @unittest.skipIf(scipy is None, "SciPy is not there")
    def test_committors_of_large_eliminated_chains_are_eliminated(self):
        # A fair walk between failure and the last state, some millions of steps.
        n = 4000
        chain = metastable.chain(scipy.sparse.diags([np.full(n - 1, .5)] * 2, [1, -1], format="csr"), [.5] + [0] * (n - 2) + [.5])
        passage = chain.committor([n - 1])
        self.assertIsNone(passage.error)
        np.testing.assert_allclose(passage.reach, np.arange(1, n + 1) / n, rtol=1e-10)

    def test_a_safe_state_leaves_committor_and_survival(self):
        chain = metastable.chain(np.diag([.5] * 5 + [1.]), [.5] * 5 + [0.])
        passage = chain.committor([0, 1])
        np.testing.assert_array_equal(passage.reach, [1, 1, 0, 0, 0, 0])
        np.testing.assert_array_equal(passage.fail, [0, 0, 1, 1, 1, 0])
        np.testing.assert_array_equal(passage.steps, [0, 0, 2, 2, 2, np.inf])
        np.testing.assert_allclose(chain.survival(0, [1, 5]), [.5, .5**5], rtol=1e-14)
        np.testing.assert_array_equal(chain.survival(5, [1, 5, np.inf]), 1)
        with self.assertRaisesRegex(metastable.ComputationError, "state 5"):
            chain.first_passage()
        pair = metastable.chain(np.diag([.999, .999999]), [1e-3, 1e-6])
        np.testing.assert_allclose(pair.survival(0, [1]), [.999], rtol=1e-15)

    @unittest.skipIf(scipy is None, "SciPy is not there")
    def test_a_diagonal_is_given_or_left_out_as_a_whole(self):
        rows, kill = [[.6, .3, 0], [.2, .5, .2], [.5, .4, 0]], [.1, .1, 0]
        for matrix in (rows, scipy.sparse.csr_matrix(rows)):
            with self.assertRaisesRegex(metastable.InputError, "row 2 and its kill rate sum to 0.9, 1 expected where "
                                                               "the diagonal is given, as it is in row 0"):
                metastable.chain(matrix, kill)
        stored = scipy.sparse.coo_matrix(([0., .5, .5], ([0, 0, 1], [0, 1, 0])), shape=(2, 2))
        with self.assertRaisesRegex(metastable.InputError, "row 0 and its kill rate sum to 0.6"):
            metastable.chain(stored, [.1, .5])
        left_out = metastable.chain([[0, .5], [.5, 0]], [.1, .5]).first_passage().mean
        np.testing.assert_allclose(left_out, metastable.chain([[.4, .5], [.5, 0]], [.1, .5]).first_passage().mean)

    def test_numbers_are_right_or_refused(self):
        kill, right = [.5, .5], metastable.chain([[.25, .25], [0, .5]], [.5, .5]).first_passage().mean
        for matrix in (np.array([[.25, .25], [0, .5]], object), np.array([[.25, .25], [0, .5]], np.float32),
                       np.asfortranarray([[.25, .25], [0, .5]])):
            np.testing.assert_array_equal(metastable.chain(matrix, kill).first_passage().mean, right)
        for whole in (int, bool, np.uint8):
            mean = metastable.chain(np.array([[0, 1], [0, 0]], whole), np.array([0, 1], whole)).first_passage().mean
            np.testing.assert_array_equal(mean, [2, 1])
        for matrix, sentence in (
            (np.array([[.25, .25j], [0, .5]]), "matrix: real numbers expected, not complex128"),
            (np.array([[.25, .25 + 0j], [0, .5]], object), "matrix: real numbers expected"),
            (np.array([[".25", ".25"], ["0", ".5"]]), "matrix: real numbers expected"),
            (np.array([[".25", .25], [0, .5]], object), "matrix: real numbers expected"),
            (np.array([[None, .25], [0, .5]], object), "matrix: real numbers expected"),
            (np.ma.masked_greater([[.25, .25], [0, .5]], .3), "matrix: a masked array"),
            ([[.25, .25], [.5]], "matrix: an array of numbers expected"),
            (np.array([[np.nan, .25], [0, .5]]), "row 0"),
        ):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.chain(matrix, kill)
        with self.assertRaisesRegex(metastable.InputError, "kill: real numbers expected, not complex128"):
            metastable.chain(np.zeros((2, 2)), [.5, .5j])
        if np.finfo(np.longdouble).tiny < 1e-400:
            with self.assertRaisesRegex(metastable.InputError, "kill: a number other than 0 is too small"):
                metastable.chain(np.zeros((1, 1)), np.array(["1e-400"], np.longdouble))
        if scipy is not None:
            with self.assertRaisesRegex(metastable.InputError, "matrix: real numbers expected, not complex128"):
                metastable.chain(scipy.sparse.csr_matrix([[.25, .25j], [0, .5]]), kill)

    def test_states_are_those_of_the_chain(self):
        chain = metastable.chain([[0, .5], [.5, 0]], [.5, .5])
        for ask, sentence in ((lambda: chain.committor([2]), "states: 2 is not one of 0 to 1"),
                              (lambda: chain.committor([-1]), "states: -1 is not one of 0 to 1"),
                              (lambda: chain.committor([.5]), "states: a list of indices or 2 booleans"),
                              (lambda: chain.survival(2, [1]), "^start: 2 is no distribution over the states, nor an "
                                                               "index from 0 to 1$"),
                              (lambda: chain.survival(-1, [1]), "^start: -1 is no distribution"),
                              (lambda: chain.survival(.5, [1]), "^start: 0.5 is no distribution"),
                              (lambda: chain.survival(None, [1]), "^start: None is no distribution"),
                              (lambda: chain.survival(True, [1]), "^start: True is no distribution"),
                              (lambda: chain.survival([1, 0], [-1]), "^steps: -1 is no whole number from 0 on, nor "
                                                                     "infinity$"),
                              (lambda: chain.survival(0, [1.5]), "^steps: 1.5 is no whole number"),
                              (lambda: chain.survival(0, [np.nan]), "^steps: nan is no whole number"),
                              (lambda: chain.survival([1, 0], [1j]), "steps: real numbers expected"),
                              (lambda: chain.survival([.5, 0], [1]), "start: probabilities sum to 0.5, 1 expected")):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                ask()

    def test_no_chains_are_refused(self):
        for matrix, kill, sentence in (
            (np.ones((2, 3)), [0, 0], r"matrix: shape \(2, 3\), \(2, 2\) expected"),
            (np.eye(2), [[0.1, 0.1]], r"kill: a vector expected"),
            (np.array([[0, 0.9], [0.5, 0]]), [0.2, 0], "row 0"),
            (np.array([[0.5, 0.3], [0.5, 0]]), [0.1, 0], "row 0 and its kill rate sum to 0.9, 1 expected"),
            (np.array([[0, -0.1], [0.5, 0]]), [0.2, 0], "row 0"),
            (np.array([[0, np.nan], [0.5, 0]]), [0.2, 0], "row 0"),
        ):
            with self.assertRaisesRegex(metastable.InputError, sentence):
                metastable.chain(matrix, kill)
        with self.assertRaisesRegex(metastable.ComputationError, "state 0"):
            metastable.chain(np.array([[0, 0.5], [0.5, 0]]), [0, 0]).first_passage()
        with self.assertRaisesRegex(metastable.InputError, "states: 3 marks given for 2 states"):
            metastable.chain(np.zeros((2, 2)), [1, 1]).committor([True, False, True])


if __name__ == "__main__":
    unittest.main()
