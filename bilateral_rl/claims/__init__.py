"""The paper's claims C1 to C14 (paper section 7), each computed from the results of a study."""

from bilateral_rl.claims.claim import Aside, Claim, Component
from bilateral_rl.claims.criteria import Criteria
from bilateral_rl.claims.evaluation import evaluate_claims
from bilateral_rl.claims.judgement import Judgement
from bilateral_rl.claims.rules import Verdict

__all__ = ["Aside", "Claim", "Component", "Criteria", "Judgement", "Verdict", "evaluate_claims"]
