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
        np.testing.assert_allclose(chain.survival(3, [0, 1, 7]),
                                   [np.linalg.matrix_power(matrix, k)[3].sum() for k in (0, 1, 7)], rtol=1e-10)
        into = np.arange(n) < 3
        away = np.linalg.solve(np.eye(n - 3) - matrix[3:, 3:], matrix[3:, :3].sum(axis=1))
        np.testing.assert_allclose(chain.committor([0, 1, 2]).reach[3:], away, rtol=1e-11)
        np.testing.assert_array_equal(chain.committor(into).reach[:3], 1)

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
